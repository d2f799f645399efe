"""What a word means that is no rule: a clause, a type, a field, a value, a word that the document prints.

`finding` finds what there is to tell of a word, or words that are near; `page` writes it.
"""
