"""Meanings of words that are no rules: clauses, types, fields, values, words that a document prints.

`finding` finds what there is to tell of a word, or words that are near; `page` writes it.
"""
