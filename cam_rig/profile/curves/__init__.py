"""Contours as curves to be drawn, cut and measured."""
