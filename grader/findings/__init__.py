"""What a check or an explanation says: findings with their evidence, and the words for values."""
