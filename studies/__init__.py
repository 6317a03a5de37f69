"""Studies: programs that compute the results of the documents with the library, and draw their figures."""
