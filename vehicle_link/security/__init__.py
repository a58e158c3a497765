"""Certificates, access rights, and the identity of the other end."""
