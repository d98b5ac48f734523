"""A page on localhost to drop files on, and to have them diagnosed.

The server only passes on bytes and texts. A separate process reads models and records, simulates
and diagnoses; cancelling ends the process. The page has one session, that of whoever has its
address: the address holds a secret.
"""
