"""Like revolutions averaged into pieces and cells: all that later steps need of a log."""
