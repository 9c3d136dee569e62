"""Results of checks and explanations: findings with their evidence, and words for values."""
