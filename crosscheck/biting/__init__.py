"""Proof that cases bite: faults that their goals must notice, and changes without meaning that they must not."""
