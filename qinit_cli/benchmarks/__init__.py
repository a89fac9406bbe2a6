"""What `qinit bench` times, each thing beside the way a researcher would write it; printing is the command's."""
