"""Tests of the cases themselves: faults that their goals must notice, and invariances under which results must
agree."""
