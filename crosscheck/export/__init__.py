"""The library of cases as an archive that needs none of our code: data, other formats, references, citation."""
