"""Builds simulators, plays jobs in them and follows these from outside."""
