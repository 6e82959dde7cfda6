"""Pictures: tables and fits in, one file out.

Imported only where a command was asked for a picture.
"""
