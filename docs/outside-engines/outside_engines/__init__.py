"""Adapters of two codes that flexmb does not know, and what they share."""
