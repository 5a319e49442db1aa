"""What a study file may hold: a design, a factorial, a campaign."""
