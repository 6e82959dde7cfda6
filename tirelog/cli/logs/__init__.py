"""Commands on logs, and those that make tables of them."""
