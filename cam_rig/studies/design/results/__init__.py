"""What designs come to: a table, a front of two quantities, the best laws beside the paper's."""
