"""Figures of sound: levels over speed, the noise study, orders."""
