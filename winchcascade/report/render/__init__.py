"""How a report is laid out: for a terminal, as a page, as a PDF, and as files of its tables and
figures.
"""
