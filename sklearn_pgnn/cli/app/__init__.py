"""A page on localhost to drop files on, and to have them diagnosed.

The server only passes on bytes and texts. A separate process for every visitor reads models and
records, simulates and diagnoses; cancelling ends the process.
"""
