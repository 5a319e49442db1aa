"""Pictures of a campaign: a map, the distributions, what each input does."""
