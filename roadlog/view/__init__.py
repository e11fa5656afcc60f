"""A drive in Rerun: what is shown, the recording, the layout."""
