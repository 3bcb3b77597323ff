"""`taxel reproduce`: one file a published table or study."""
