"""The checklist of the day: what a laboratory looks at before it flies, ticked by whoever did."""
