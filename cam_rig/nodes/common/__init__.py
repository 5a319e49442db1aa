"""What nodes share: the base class, parameters, conversion of messages."""
