"""Why something that was asked for is not there: a cause, and what to try next."""
