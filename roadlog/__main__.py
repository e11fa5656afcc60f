"""`python -m roadlog`."""

from roadlog.cli import main

main()
