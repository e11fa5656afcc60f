"""A drive in Rerun: what is shown (model), the recording, the layout."""
