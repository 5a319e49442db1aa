"""Model `torsional`: a cam on an elastic shaft (eq. 10 of the paper)."""
