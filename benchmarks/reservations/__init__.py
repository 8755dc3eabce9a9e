"""What verdicts say of records that are right and of records with one fault each."""
