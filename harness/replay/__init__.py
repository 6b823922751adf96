"""What a log proves: replay, audit, and what other settings would have done."""
