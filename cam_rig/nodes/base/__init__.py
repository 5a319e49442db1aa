"""Base class of the nodes, and the components of which it is composed."""
