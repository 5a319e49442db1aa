"""What error is measured against: solutions of many digits, computed and stored."""
