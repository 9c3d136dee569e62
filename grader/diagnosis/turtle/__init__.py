"""Why a turtle did not do what was asked for."""
