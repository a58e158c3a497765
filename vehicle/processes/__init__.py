"""The processes of one vehicle: their parent, and the shared memory that connects them."""
