"""Turns a store into results for people: classes, results.json, analyses, tables, exports."""
