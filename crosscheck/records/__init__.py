"""What a run leaves behind: the kinds of records, the file that holds them, and what made each result."""
