"""`python -m tirelog`."""

from tirelog.cli import main

main()
