"""Designs that no convex program finds: local searches from many starts, without a bound."""
