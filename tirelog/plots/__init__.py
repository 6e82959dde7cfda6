"""Pictures: tables and fits in, one file out.

Imported only if a command was asked for a picture.
"""
