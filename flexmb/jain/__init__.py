"""The recursions of Jain and Rodriguez (1992), O(N), and the same equations as dense operators."""
