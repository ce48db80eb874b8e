"""The library of cases as an archive that needs none of this project's code: data, other formats, references, citation."""
