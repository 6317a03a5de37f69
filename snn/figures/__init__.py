"""Fig. 8, Fig. 9 and confusion matrices: data first, then the pictures made from them."""
