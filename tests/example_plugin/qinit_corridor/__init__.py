"""A plug-in of qinit: the family corridor and the method cautious."""
