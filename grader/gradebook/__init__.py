"""The grades of a class: what the rules of its course and its instructor make of them."""
