"""One file a command: parse, call a stage, write what it yields, print."""
