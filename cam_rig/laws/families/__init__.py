"""The families of rises and curves, each made into Bernstein pieces."""
