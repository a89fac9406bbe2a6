"""A page of HTML from plain data: no file is read here, nothing is drawn and nothing computed."""
