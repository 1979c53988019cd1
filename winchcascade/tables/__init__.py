"""Published tables: results checked against them, tables audited, and the range that a rig can
attain.
"""
