"""LabVIEW's `.lvm` text files: read and written."""
