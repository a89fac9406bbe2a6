"""A plug-in of qinit: the family corridor and the methods cautious and hopeful."""
