"""What words mean: the columns of the tables, and units and their conversion at the edges."""
