"""Pictures of the tables that are made of a log."""
