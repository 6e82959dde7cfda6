"""Which physical effect a model lacks: compare, diagnose, ladder, and their wording."""
