"""What a user would pick instead, written as its own users would write it, and well."""
