"""Text logs of interrogators and loggers: layout by content, parsed in compiled passes."""
