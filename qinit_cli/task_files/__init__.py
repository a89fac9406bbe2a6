"""Files of tasks of one's own: archives of transitions and folders of maps, read and checked."""
