"""Page of several vehicles."""
