"""A page on localhost to drop files on, and to have them diagnosed.

The server only moves bytes and words. A process of its own for every visitor reads models and
records, simulates and diagnoses; to cancel is to end it.
"""
