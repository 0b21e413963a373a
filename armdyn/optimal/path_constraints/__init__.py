"""What may be asked along the way besides limits; one file each."""
