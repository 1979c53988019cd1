"""Tables that others have printed: results checked against them, and the tables held against themselves."""
