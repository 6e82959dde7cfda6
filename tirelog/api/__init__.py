"""What `import tirelog` offers, and what each command calls."""
