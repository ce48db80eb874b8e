"""Proof that cases bite: deliberate faults that their goals must notice, and changes of no meaning that they must not."""
