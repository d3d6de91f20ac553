"""The twin in three dimensions (MuJoCo)."""
